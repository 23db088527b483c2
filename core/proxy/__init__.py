"""A mesh that stands for the scan where a program needs a surface: made from the depth of the splat at one or more cameras."""

from .make import ProxyStep, iterate_proxy, make_proxy
from .mesh import ProxyMesh
from .settings import ProxySettings

__all__ = ["ProxyMesh", "ProxySettings", "ProxyStep", "iterate_proxy", "make_proxy"]
