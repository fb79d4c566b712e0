// Times Fields2Cover 2.1 (not part of this repository) on fields that `bench/fields2cover.rs` also plans.
// Input, one field: lane angle in radians, lane width, rings; each ring its count of points, then x and y of each, metres,
// the outer one first. Output: length of all lanes, then of the best order of lanes with straight connections, metres;
// microseconds of making lanes and that order, median; connections that cross a hole; the order's name.
// Build: see `build` there.

#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "fields2cover/route_planning/boustrophedon_order.h"
#include "fields2cover/route_planning/snake_order.h"
#include "fields2cover/route_planning/spiral_order.h"
#include "fields2cover/swath_generator/swath_generator_base.h"
#include "fields2cover/types.h"

// Lanes at an angle that is given.
struct Lanes : f2c::sg::SwathGeneratorBase {
    double computeBestAngle(f2c::obj::SGObjective &, double, const F2CCell &) override {
        throw std::logic_error("the angle is given");
    }
};

static double connections_m(F2CSwaths &swaths) {
    double sum = 0.0;
    for (size_t i = 1; i < swaths.size(); ++i) {
        sum += swaths[i - 1].endPoint().distance(swaths[i].startPoint());
    }
    return sum;
}

int main(int argc, char **argv) {
    const int runs = argc > 1 ? std::atoi(argv[1]) : 11;
    double angle, width;
    std::cin >> angle >> width;
    F2CCell cell;
    std::vector<F2CCell> holes;
    size_t count;
    while (std::cin >> count) {
        F2CLinearRing ring;
        for (size_t i = 0; i < count; ++i) {
            double x, y;
            std::cin >> x >> y;
            ring.addPoint(F2CPoint(x, y));
        }
        ring.addPoint(ring[0]);
        cell.addRing(ring);
        if (cell.size() > 1) {
            holes.emplace_back(ring);
        }
    }
    Lanes lanes;
    lanes.setAllowOverlap(true);
    std::vector<std::pair<std::string, std::unique_ptr<f2c::rp::SingleCellSwathsOrderBase>>> orders;
    orders.emplace_back("boustrophedon", std::make_unique<f2c::rp::BoustrophedonOrder>());
    orders.emplace_back("snake", std::make_unique<f2c::rp::SnakeOrder>());
    for (size_t size : {2, 4, 6}) {
        orders.emplace_back("spiral " + std::to_string(size), std::make_unique<f2c::rp::SpiralOrder>(size));
    }
    double best_m = 1e300, lanes_m = 0.0, best_us = 0.0;
    int crossings = 0;
    std::string name;
    for (auto &&[label, order] : orders) {
        for (uint32_t variant = 0; variant < 4; ++variant) {
            std::vector<double> times;
            F2CSwaths route;
            for (int run = 0; run < runs; ++run) {
                auto begin = std::chrono::steady_clock::now();
                route = order->genSortedSwaths(lanes.generateSwaths(angle, width, cell), variant);
                auto end = std::chrono::steady_clock::now();
                times.push_back(std::chrono::duration<double, std::micro>(end - begin).count());
            }
            std::nth_element(times.begin(), times.begin() + runs / 2, times.end());
            double own_m = 0.0;
            for (size_t i = 0; i < route.size(); ++i) {
                own_m += route[i].length();
            }
            double total_m = own_m + connections_m(route);
            if (total_m < best_m) {
                best_m = total_m, lanes_m = own_m, best_us = times[runs / 2], name = label;
                crossings = 0;
                for (size_t i = 1; i < route.size(); ++i) {
                    F2CLineString way({route[i - 1].endPoint(), route[i].startPoint()});
                    crossings += std::any_of(holes.begin(), holes.end(), [&](const F2CCell &hole) {
                        auto inside = hole.buffer(hole, -0.01);
                        return inside.size() > 0 && way.crosses(inside);
                    });
                }
            }
        }
    }
    std::cout << lanes_m << ' ' << best_m << ' ' << best_us << ' ' << crossings << ' ' << name << std::endl;
}
