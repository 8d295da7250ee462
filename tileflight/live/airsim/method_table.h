#pragma once

#include <functional>

#include "tileflight/live/airsim/levels.h"
#include "tileflight/live/rpc/method_table.h"
#include "tileflight/live/rpc/server.h"

namespace tileflight::airsim {

/// RPC name of tfAuthenticate, which the server answers itself.
inline constexpr const char* kAuthenticateMethod = "tfAuthenticate";

/// Makes the table of all methods that clients may call, AirSim's and the extensions. They call the simulator that is
/// served. `levels` must outlive the table. `statistics` returns those of the server, for tfStatistics; it is called
/// from the threads that answer requests.
rpc::MethodTable make_method_table(Levels& levels, const std::function<rpc::ServerStatistics()>& statistics);

}  // namespace tileflight::airsim
