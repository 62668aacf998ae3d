#pragma once

#include <string>
#include <vector>

namespace subworld {

/// The options of `subworld collect`.
struct CollectRequest {
  std::vector<std::string> folders;  ///< results of the programs of one run
  std::string scene;                 ///< its file, where it lies elsewhere than on the world's host; empty: the same
  std::string out;                   ///< empty: a new folder
  std::string command_line;
  bool explain = false;
  bool strict = false;
};

/// Makes one summary, with gates and a verdict, of results that programs wrote into several folders. Returns the exit
/// code. Throws `Error` (usage) where a part is missing, there twice, or of another run.
int collect(const CollectRequest& request);

/// Copies the programs' results that lie in the folders, at any depth, into `out`. Throws `Error` (usage) where a
/// program's results are there twice.
void merge_results(const std::vector<std::string>& folders, const std::string& out);

}  // namespace subworld
