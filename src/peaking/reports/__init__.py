"""What reports share: parts of pages, scales of charts. A report lies beside what it reports on."""
