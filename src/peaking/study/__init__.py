"""User studies: protocol, records, questionnaires, statistics. Knows nothing of rendering."""
