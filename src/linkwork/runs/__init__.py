"""What a robot does over time: runs from chart to chart, single or many, and what they tell."""
