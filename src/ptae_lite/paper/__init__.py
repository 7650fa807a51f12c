"""The paper: its numbers, its claims, and the report card that compares them with our tables."""
