"""Evolution and dispatch: births, selection, survival, and which worker does what.

Pure state machines (``islands``, ``arena``, ``dispatch``, ``evolution``) take events
and return commands. Only ``network``, ``storage``, ``run`` and ``cli`` use network,
disk, clock or terminal.
"""
