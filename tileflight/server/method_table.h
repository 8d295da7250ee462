#pragma once

#include <functional>

#include "tileflight/rpc/method_table.h"
#include "tileflight/rpc/server.h"
#include "tileflight/simulator/simulator.h"

namespace tileflight::server {

/// All that clients may call: AirSim's methods and the own ones, each a method of `simulator`, which must outlive the
/// table. `statistics`: of the server that serves it, for tfStatistics; called by the threads that answer.
rpc::MethodTable make_method_table(simulator::Simulator& simulator,
                                   const std::function<rpc::ServerStatistics()>& statistics);

}  // namespace tileflight::server
