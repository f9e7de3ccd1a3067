"""Result in Python and in notebooks: pandas tables, matplotlib plots, and display."""
