"""The model of Neis and Beyerer (arXiv:2405.17080): smoothed Markov chain and shaped noise."""
