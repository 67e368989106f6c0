"""The gap diagnosis tried blind: cases are made and sealed, solved without the key, then scored."""
