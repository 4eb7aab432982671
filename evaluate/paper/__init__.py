"""Reproduction of the experiments of the paper's section 4.

Reads a comparison (`evaluate/compare`) and runs the trained policies in scenarios and rooms; writes
study.html, study.json, figures and tables. Nothing outside this package imports it.
"""
