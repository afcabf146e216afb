"""Site files: what is measured and agreed of a room before a vehicle flies in it.

file    the fields, and how a file is read
place   an experiment as it is flown at a site
checks  whether site, experiment and tracking fit each other
"""
