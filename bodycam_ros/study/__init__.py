"""All steps for a folder of recordings, or for many recordings; what is done for the present inputs is left alone."""
