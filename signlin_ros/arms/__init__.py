"""Arms against their records: how good the rigid body is, what friction adds, and what is missing in which joint.

`data` reads, `piece` filters and makes rows, `laws` are their columns, `fit` and `search` what stands, `verbs` the page
on which these follow each other, `told` and `text` what is said.
"""
