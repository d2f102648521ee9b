"""The experiments of published papers, on a robot whose truth the product cannot see."""
