#include "io/machine_share.hpp"

namespace subworld {

Json MachineShare::json() const {
  return {{"scheduling", granted_.text},
          {"fifo", granted_.fifo},
          {"memory_locked", granted_.memory_locked},
          {"cpu_s", share_.cpu_s},
          {"run_queue_delay_s", share_.run_queue_delay_s},
          {"involuntary_switches", share_.involuntary_switches},
          {"voluntary_switches", share_.voluntary_switches},
          {"stolen_s", share_.stolen_s}};
}

}  // namespace subworld
