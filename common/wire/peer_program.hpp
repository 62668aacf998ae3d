#pragma once

#include <string>

namespace subworld {

/// The program of another participant, as discovery describes it. Empty: not known.
struct PeerProgram {
  std::string name;
  std::string process;
  std::string host;
  std::string dds;  ///< "fastdds", "cyclonedds"
};

/// "world_sim, process 123 on host"
[[nodiscard]] std::string to_text(const PeerProgram& program);

}  // namespace subworld
