"""Definitions that processes and files share.

Robots, genomes, experiments, messages, tables, robot files and the translation of
robots into MuJoCo; and the runtime of workers and analyzers. This package makes no
decisions and simulates nothing. Only its `service` opens sockets, and it imports no
other package of the project.
"""
