"""What two features say together, with variance: section 4 of the paper, and the gates of section 5."""
