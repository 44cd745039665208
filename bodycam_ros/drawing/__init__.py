"""What pictures share, whoever shows them: colours and type, the lines of a body, what a camera should have seen."""
