#include "tileflight/live/airsim/method_table.h"

#include "tileflight/live/airsim/airsim_methods.h"

namespace tileflight::airsim {

rpc::MethodTable make_method_table(Levels& levels, const std::function<rpc::ServerStatistics()>& statistics) {
  rpc::MethodTable table;
  MethodBinder<SimulatorCaller> bind(table, SimulatorCaller(levels));
  add_airsim_methods(bind);
  add_extension_methods(bind, statistics);
  mark_slow_methods(table);
  return table;
}

}  // namespace tileflight::airsim
