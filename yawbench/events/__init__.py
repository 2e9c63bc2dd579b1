"""Events of a run: what began and ended when, at which wheel or axle, by how much; and why a car was lost.

`EVENTS` in `kinds` lists the kinds of events, `EventWatch` finds them in the rows of a run, `events_in` in
recorded results, and `why` names from them the cause of a loss. Runs are warned of some of them.
"""
