"""Pages for people: self-contained HTML files made from results."""
