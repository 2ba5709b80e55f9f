"""Simulated photographers in drawn scenes: does guidance help in the closed loop?"""
