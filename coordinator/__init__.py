"""Who is born, mates, survives; and who evaluates what.

Pure machines (`island`, `dispatch`) take events and return commands. Only
`service`, `journal`, `record` and `__main__` touch network, disk or terminal.
"""
