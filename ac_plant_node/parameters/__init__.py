"""The car's parameters: values, file, schema."""
