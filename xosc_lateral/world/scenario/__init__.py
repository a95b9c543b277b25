"""The storyboard as data: frozen elements under the standard's names, parameters, expressions."""
