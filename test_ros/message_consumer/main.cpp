#include <iostream>

#include "bodycam_msgs/msg/landmark_matches.hpp"

int main()
{
  bodycam_msgs::msg::LandmarkMatches matches;
  matches.map_identity = "9f86d081884c7d65";
  std::cout << matches.map_identity << std::endl;
}
