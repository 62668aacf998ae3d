#pragma once

#include "io/options/live_options.hpp"

#include <string>

namespace subworld {

/// Completes the options for --page: a free port where none is given. Throws `Error` (failed) where there is none, or
/// another program has the one that is given.
void choose_live_port(LiveOptions& live, bool page);

/// "127.0.0.1:8765"
[[nodiscard]] std::string own_address(const std::string& host, int port);
/// The page's address; with a token the user adds it: "http://127.0.0.1:8765/?token=TOKEN".
[[nodiscard]] std::string page_address(const LiveOptions& live);

/// Opens the page in the user's browser, once it is served, where a desktop is present.
class PageOpener {
 public:
  PageOpener(const LiveOptions& live, bool wanted);
  /// Once in a while.
  void operator()();

 private:
  LiveOptions live_;
  bool waiting_;
};

}  // namespace subworld
