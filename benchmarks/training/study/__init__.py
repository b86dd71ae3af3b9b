"""Many trainings together: seeds, algorithms, what each piece of knowledge is worth, judged."""
