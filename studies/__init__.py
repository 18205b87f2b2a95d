"""Studies made with ship_trl: the plan, tables and verdicts of each, beside its page. Not in the wheel."""
