"""Published tables: values of known sensors, and classes of land-cover maps with the levels of their terrain."""
