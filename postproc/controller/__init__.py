"""Runs KRL text as the controller does; knows no planner and passes no judgement."""
