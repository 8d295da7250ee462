#include "tileflight/server/method_table.h"

#include "tileflight/server/airsim_methods.h"
#include "tileflight/server/own_methods.h"

namespace tileflight::server {

rpc::MethodTable make_method_table(simulator::Simulator& simulator,
                                   const std::function<rpc::ServerStatistics()>& statistics) {
  rpc::MethodTable table;
  Binder<SimulatorCaller> bind(table, SimulatorCaller(simulator));
  add_airsim_methods(bind);
  add_own_methods(bind, statistics);
  return table;
}

}  // namespace tileflight::server
