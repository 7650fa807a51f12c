"""The paper: its numbers, its claims, and the report card that holds them against our tables."""
