"""How a node is made ready before its drives get power: the sequence, its steps, what it sets."""
