"""Every sentence that a diagnosis prints.

| module | sentences | where they are printed |
|---|---|---|
| `phrases` | why an effect is refused, why the estimates differ, notes: templates | ranking, notes |
| `reasons` | why records are not explained: `REASONS`; `verdict.reason_of` says when | the verdict |
| `verdicts` | the verdict itself, what is left, why an effect is named or not | the verdict, ranking |
| `closed_loops` | what records of a servo cannot tell, and which others would | notes, experiments |
| `planned_rivals` | what became of the rivals of a planned experiment | the verdict |

Some stand elsewhere: what a record shows of an effect is its class's ``finding`` (`signlin_ros.effects`), what
`compare` says too is in `signlin_ros.comparison.scores`, and notes on records stand where these are made ready
(`signlin_ros.fitting.prepare`). A sentence holds no number that no table shows.
"""
