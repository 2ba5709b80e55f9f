"""What reports share: parts of pages, scales of charts. The reports are beside what they report."""
