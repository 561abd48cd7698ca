"""Evidence: sweeps over many cases that are kept on disk, and the tables, figures and pages made of them."""
