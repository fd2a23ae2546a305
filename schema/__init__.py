"""What two processes, or a process and a file, must agree on.

Robots, brains, genomes, experiments, messages, tables and the one translation
of a robot to MuJoCo. Nothing here decides, simulates or opens a socket, and
nothing here imports another room.
"""
