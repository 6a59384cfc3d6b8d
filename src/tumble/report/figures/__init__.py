"""The figures of the pages: plain data for the plotting library, and drawings as SVG."""
