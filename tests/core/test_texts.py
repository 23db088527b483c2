"""Every text that a user of Blender sees can be translated: a walk of the Blender side's sources.

Blender looks up plain texts by itself. What is put together at run time must be looked up as a template, and only then filled.
"""

import ast
import builtins
import re
import string
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
# The command line and the text of Report a Problem are English by design: they are pasted, searched for and parsed.
ENGLISH = {"command.py", "blend_file.py", "problem.py"}
SOURCES = [*(REPO / "gssmc_addon").rglob("*.py"), *(REPO / "operators").glob("*.py")]
SOURCES = sorted(path for path in SOURCES if path.name not in ENGLISH)
LOOKUPS = {"iface_", "rpt_", "tip_"}
MARK = "n_"
SAID = {"report", "poll_message_set"}  # their plain arguments are texts; the others' are names of properties and operators
BY_BLENDER = {*SAID, "label", "prop", "operator", "menu", "progress", "invoke_props_dialog"}
OURS = {"draw_text", "tell", "refuse", "status_text_set"}  # who calls these has looked the text up
SENTENCE = re.compile(r"[A-Za-z]{2,} [A-Za-z]{2,}|[a-z]{3,}\.$")


def name(path):
    return path.relative_to(REPO).as_posix()


def called(node):
    """The name of the function that a call calls, without what it belongs to."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def calls(path):
    return [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]


def outside_lookups(node):
    """The node and all below it, but nothing of what is looked up."""
    if isinstance(node, ast.Call) and called(node) in LOOKUPS | {MARK}:
        return
    yield node
    for child in ast.iter_child_nodes(node):
        yield from outside_lookups(child)


def words_of(node):
    """The fixed words of an f-string, a format() call or a % expression; "" for any other node."""
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
    if isinstance(node, ast.Call) and called(node) == "format":
        return text_of(node.func.value) if isinstance(node.func, ast.Attribute) else ""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod | ast.Add):
        return text_of(node.left) or text_of(node.right)
    return ""


def text_of(node):
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def is_error(node):
    """An error for the user; Python's own are for programmers, or are put into one."""
    return isinstance(node, ast.Call) and called(node).endswith("Error") and not hasattr(builtins, called(node))


def shown(path):
    """(line, expression) of every text that is handed to the user interface, a report or an error."""
    for call in calls(path):
        if called(call) in BY_BLENDER | OURS:
            named = [word.value for word in call.keywords if word.arg in ("text", "title", "confirm_text", "message")]
            plain = call.args if called(call) in SAID | OURS else []
            yield from ((call.lineno, argument) for argument in [*plain, *named])
        if is_error(call) and call.args:
            yield call.lineno, call.args[0]


def test_the_walk_finds_texts():
    assert len(SOURCES) > 50
    assert sum(len(list(shown(path))) for path in SOURCES) > 200
    assert sum(called(call) in LOOKUPS for path in SOURCES for call in calls(path)) > 100


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_no_text_is_put_together_where_it_is_shown(path):
    found = [(line, node) for line, text in shown(path) for node in outside_lookups(text)]
    assert [(line, ast.unparse(node)) for line, node in found if re.search("[A-Za-z]{2}", words_of(node))] == []


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_no_sentence_is_put_together_anywhere(path):
    """A function may return it, or a variable hold it, long before it is shown."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    properties = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and called(node).endswith("Property")]
    registered = {id(node) for call in properties for node in ast.walk(call)}  # Blender sees these whole
    found = [n for n in outside_lookups(tree) if id(n) not in registered and SENTENCE.search(words_of(n))]
    assert [(node.lineno, ast.unparse(node)) for node in found] == []


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_errors_and_our_own_helpers_get_looked_up_sentences(path):
    """They keep a sentence, and wrap it, before Blender could find it whole."""
    for call in calls(path):
        if is_error(call) or called(call) in OURS:
            assert [text_of(node) for node in call.args if len(text_of(node)) > 8] == [], f"{name(path)}:{call.lineno}"


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_a_grey_button_says_what_to_do(path):
    """What is missing, a semicolon, and what to do about it, as every refusal."""
    for call in calls(path):
        if called(call) == "poll_message_set" and (text := text_of(call.args[0])):
            assert re.fullmatch(r"[A-Z][^;]+; [a-z][^;.]+", text), f"{name(path)}:{call.lineno}"


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_templates_stand_where_an_extractor_finds_them_and_get_their_values(path):
    for call in calls(path):
        if called(call) not in LOOKUPS | {MARK} or path.name == "texts.py":
            continue
        (template,) = call.args
        where = f"{name(path)}:{call.lineno}"
        assert not isinstance(template, ast.JoinedStr | ast.BinOp), where
        assert called(call) != MARK or text_of(template), where
        wanted = {field for _, field, _, _ in string.Formatter().parse(text_of(template)) if field is not None}
        assert "" not in wanted, f"{where}: values need names, for other languages order them otherwise"
        if text_of(template) and called(call) in LOOKUPS and all(word.arg for word in call.keywords):
            assert wanted == {word.arg for word in call.keywords}, where


PLURAL = re.compile(r"\{\w+\} (?:(?P<things>[A-Za-z]{3,})s|were|have)\b")  # "{count} photos", "{count} were"
NEVER_ONE = {"float", "need"}  # a number of floats is that of a splat's format; "{name} needs" is no plural


def templates(path):
    """(line, template) of every text that is looked up and filled in."""
    found = [(c.lineno, text_of(c.args[0])) for c in calls(path) if called(c) in LOOKUPS | {MARK} and c.args]
    return [(line, text) for line, text in found if text]


def singular(words):
    """What stands for a plural where there is one of the things."""
    return rf"\b1 {words.removesuffix('es')}\b|\b1 {words[:-1]}\b" if words.endswith("s") else r"\b1 (was|has|could)\b"


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_one_thing_is_not_told_of_in_the_plural(path):
    """Blender's lookup knows no plural forms: where a number may be 1, the file has a template that says so."""
    texts = templates(path)
    for line, text in texts:
        for match in PLURAL.finditer(text):
            if match["things"] in NEVER_ONE:
                continue
            words = match[0].split(" ", 1)[1]
            assert any(re.search(singular(words), other) for _, other in texts), f"{name(path)}:{line}: {text}"
