"""The paper this package starts from: its stated numbers and its figures, beside our runs.

K. Kubas, "A model for the dynamic analysis of a belt transmission using the Dahl friction model".
"""
