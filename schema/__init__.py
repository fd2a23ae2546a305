"""What two processes, or a process and a file, must agree on.

Robots, brains, genomes, experiments, messages, tables and the one translation
of a robot to MuJoCo; and how an agent lives on the network, which workers and
analyzers share. Nothing here decides or simulates, only `service` opens a socket,
and nothing here imports another room.
"""
