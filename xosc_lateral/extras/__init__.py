"""What stands on the core, each whole: found by its folder (`base/plugins.py`), never imported by the core.

An extra's package says what it offers. `VERBS`: name of a verb -> its module, what it does, the verb of the core before
which it is listed ("": last), pages that say more. `CALLS`: public name -> the module that has it.
"""
