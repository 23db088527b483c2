"""The three folders of the extension under one package name, for mypy alone.

In Blender the checkout itself is the package, so that `gssmc_addon` and `operators` import `..core`. mypy has to know that
package by a name, and the name of a checkout's folder may be anything. Nothing at run time imports this.
"""
