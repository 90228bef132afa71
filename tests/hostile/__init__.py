"""Hostile cases: seeded combinations of mechanism, start, task and method, each judged by an
independent truth.

A case is a line such as "five bar x1e-06 m, singular start, ensemble, dop853, seed 17" (`cases`).
Its mechanism comes from `mechanisms`, where it starts from `starts`, what is done with it from
`tasks`, and whether the answer is right from `judges`: an answer is right to its tolerance, or it
is refused with a reason that holds. A sample runs with all other tests; LINKWORK_HOSTILE=all runs
every case, and one case runs by its name:

    LINKWORK_HOSTILE=all .venv/bin/python -m pytest tests/hostile -k "five bar x1e-06 and seed 17"
"""
