"""The workbench: a local page on which the whole loop is done by eye and by clicking.

    signlin workbench my_motor.yaml monday.csv tuesday.csv

=========== ====================================================================================
`server`    the web application and how it is started: handlers only, no numerics
`safety`    who may ask for what: Host, Origin, token, headers
`session`   one project with its two worker processes, and what a click does
`shown`     what the page shows: of the first two stages (`stages`), of the others (`further`), in its words (`wording`)
`project`   the folder ``.signlin/<id>``: choices, undo, results; nothing is lost when the server is killed
`columns`   which column of which record is which signal
`questions` what is asked of the worker, by stage
`commands`  command lines that do the same as the clicks, and the script of them all
`lane`      a worker process that can be cancelled at any moment
`worker`    what runs in it
`looking`   what is seen of a record before anything is done with it
`receiving` files that are dropped, and what a click asks for
`uploaded`  a model file is looked at before it is read; `trust`: code that was agreed to
`calls`     the one place that calls the numerics: the functions behind the command line
`sheet`     a model file from the numbers of a data sheet
`ranking`   what a diagnosis has tried so far
=========== ====================================================================================

The event loop imports none of the numerics; they run in worker processes. Names are loaded when first asked for.
"""

from __future__ import annotations

from signlin_ros.lazy import exports

_EXPORTS = {"serve": "server"}

__getattr__, __dir__ = exports(__name__, _EXPORTS)
