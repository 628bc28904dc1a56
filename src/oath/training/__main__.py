"""``python -m oath.training``: train the models and write their weights."""

from oath.training.train import main

if __name__ == "__main__":
    main()
