"""Files of anybody: bounded reading, whole writing, and how what they hold is shown to a person."""
