"""fdslam: where the robot is and what has changed, from one live image and a compact bag-of-words map."""
