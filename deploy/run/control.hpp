#pragma once

#include "model/exchange.hpp"
#include "model/network.hpp"

#include <string>

namespace subworld {

/// An order. Verb and argument are those of its `Control`.
struct Order {
  ControlVerb verb = ControlVerb::stop;
  std::string argument;
  bool for_sub_worlds = false;  ///< they execute it, and not the world
};

/// Sends one order to the programs on a domain and prints their answers. Throws `Error`: middleware where there is no
/// world within `wait_s`, failed where one refuses or does not answer within as long again.
void send_control(const Network& network, const Order& order, double wait_s);

}  // namespace subworld
