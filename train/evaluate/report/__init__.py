"""The report: one HTML file that shows a comparison, works offline and asks nothing of the network."""
