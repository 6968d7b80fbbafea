"""The process that reads files of models. It loads little, so that it starts soon."""

import sys
from pathlib import Path

from scenarios.estimators.memory_limit import limit_memory
from scenarios.estimators.model_file import read_model_numbers
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.wire import receive, send, unpack

MEMORY = 2**30
"""What reading a model may hold, bytes."""


def serve(request: int, reply: int) -> None:
    """Read files until no more are asked for.

    Args:
        request: Number of the pipe from which paths come.
        reply: Number of the pipe for what is in them.
    """
    limit_memory(MEMORY)
    send(reply, {"kind": "ready"})
    while message := receive(request):
        fields, _ = unpack(message)
        try:
            numbers = read_model_numbers(Path(fields["path"]))
        except NoModelError as error:
            send(reply, {"kind": error.kind, "why": str(error)[:500]})
        # Whatever a hostile file raises inside the library: it is a file that cannot be read.
        except Exception as error:
            send(reply, {"kind": "malformed", "why": f"cannot read {Path(fields['path']).name}: {error!r}"[:200]})
        else:
            send(reply, {"kind": "read", "why": ""}, numbers)


if __name__ == "__main__":
    serve(*(int(number) for number in sys.argv[1:3]))
