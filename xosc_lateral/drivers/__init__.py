"""How people drive: models and profiles, drives, fitting, evaluation, the loop."""
