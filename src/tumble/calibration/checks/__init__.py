"""What a recording and its residuals say against one another, and what nothing in them can say."""
