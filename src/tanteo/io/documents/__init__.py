"""Documents of tanteo: results, records, rigs, scenes and their schemas."""
