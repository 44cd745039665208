"""What ``bodycam`` without arguments says: the steps from cameras on a body to its motion, in their order."""

THE_WAY = """\
bodycam: motion capture from body-mounted cameras. The way through:

  1. Photograph the place, an AprilTag board on its floor, and make a map of it:
       bodycam map REFERENCE_DIR -o MAP
  2. Strap the cameras on and say in RIG.yaml which is on which segment. Record a
     range of motion, then what you are after. Videos of ordinary cameras become a
     bag; cameras that write ros2 bags need no such step:
       bodycam ingest FILES_OR_FOLDER -o BAG
  3. Before you take the cameras off: is it good enough? Takes seconds; leave out
     --rig where the recording is no range of motion:
       bodycam doctor ROM_BAG --map MAP --rig RIG.yaml
  4. Make the body, skeleton and camera mounts, of the range of motion:
       bodycam body ROM_BAG --map MAP --rig RIG.yaml -o BODY.yaml
  5. Solve what you recorded:
       bodycam replay BAG --map MAP --body BODY.yaml -o OUT
  6. How good is it?  summary.png in DIR is the picture to look at first:
       bodycam evaluate OUT --recording BAG -o DIR
  7. Look at it in a browser, take it to other programs:
       bodycam view OUT --map MAP --body BODY.yaml --recording BAG
       bodycam export OUT --to FORMAT -o FILE

'bodycam run DIR' takes steps 1, 2 and 4 to 6 in one go, for a folder laid out as
its --help says; 'bodycam study STUDY.yaml' for many recordings of many people.
'bodycam --help' lists all commands, 'bodycam COMMAND --help' explains one.
"""
