#pragma once

#include "model/exchange.hpp"
#include "model/network.hpp"

namespace subworld {

/// Sends one order, with a new number, to the programs on a domain and prints their answers. Throws `Error`: middleware
/// where there is no world within `wait_s`, failed where one refuses or does not answer within as long again.
void send_control(const Network& network, Control order, double wait_s);

}  // namespace subworld
