"""Whether a Dask scheduler answers at an address.

It is asked before there is a client, which waits without end for an answer of anything else that listens there, and takes
half a minute to give up an address that is none.
"""

from __future__ import annotations

import asyncio
import logging

from distributed import Security, rpc

log = logging.getLogger(__name__)

OTHER = "what listens there does not answer as a scheduler, whose port is 8786 as a rule; 8787 is its dashboard's"
SPARE_S = 1.0  # beyond the time limit of Dask, which says more than ours


def why_no_scheduler(address: str, limit_s: float) -> str:
    """In words, why there is no scheduler at `address`; empty where there is one. Takes at most `limit_s` and SPARE_S."""
    try:
        kind = asyncio.run(asyncio.wait_for(_kind(address, limit_s), limit_s + SPARE_S))
    except ValueError:
        return "that is no address; give one such as tcp://host:8786"
    except TimeoutError:
        return OTHER
    except OSError as error:
        return " ".join(str(error).split())[:200]
    except Exception as error:  # noqa: BLE001 - whatever Dask makes of an answer that is not Dask's
        log.debug("No answer of a scheduler at %s: %s", address, error)
        return OTHER
    return "" if kind == "Scheduler" else f"what listens there is a {kind.lower()}"


async def _kind(address: str, limit_s: float) -> str:
    """What Dask calls the server at `address`: "Scheduler", "Worker" or "Nanny"."""
    server = rpc(address, timeout=limit_s, connection_args=Security().get_connection_args("client"))
    try:
        return str((await server.identity())["type"])
    finally:
        await server.close_rpc()
