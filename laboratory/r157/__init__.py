"""UN R157's models of what a driver can prevent, for many encounters at once: numbers in, verdicts out.

Three yardsticks: the requirement of paragraph 5.2.5.2 (a formula), the competent and careful driver (performance model
1) and the Fuzzy Safety Model (performance model 2). The ego drives straight in its lane's middle and brakes, no more.
"""
