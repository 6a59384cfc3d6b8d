"""Tables and figures that are made anew: what an item is, and what it hands over. The items are `tumble_papers`'."""
