// Times Fields2Cover 2.1 (not part of this repository) on fields that `bench/fields2cover.rs` also plans.
// Input, one field: lane angle in radians, lane width, rings; each ring its count of points, then x and y of each, metres,
// the outer one first. Output, one line for each way over a cell: the cell, from 1, or 0 for a way over the whole field;
// microseconds, median; the order's name; the lanes in order, x and y of both ends of each.
// Microseconds of a way over the field: lanes and their order. Of one over a cell: boustrophedon decomposition of the field at
// the angle of the lanes, lanes and boustrophedon order of all cells.
// Build: see `build` there.

#include <algorithm>
#include <chrono>
#include <functional>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "fields2cover/decomposition/boustrophedon_decomp.h"
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

using Orders = std::vector<std::pair<std::string, std::unique_ptr<f2c::rp::SingleCellSwathsOrderBase>>>;

static double median_us(int runs, const std::function<void()> &work) {
    std::vector<double> times;
    for (int run = 0; run < runs; ++run) {
        auto begin = std::chrono::steady_clock::now();
        work();
        auto end = std::chrono::steady_clock::now();
        times.push_back(std::chrono::duration<double, std::micro>(end - begin).count());
    }
    std::nth_element(times.begin(), times.begin() + runs / 2, times.end());
    return times[runs / 2];
}

static void print(size_t cell, double us, const std::string &name, F2CSwaths &route) {
    std::cout << cell << ' ' << us << ' ' << name;
    for (size_t i = 0; i < route.size(); ++i) {
        const F2CPoint from = route[i].startPoint(), to = route[i].endPoint();
        std::cout << ' ' << from.getX() << ' ' << from.getY() << ' ' << to.getX() << ' ' << to.getY();
    }
    std::cout << '\n';
}

int main(int argc, char **argv) {
    const int runs = argc > 1 ? std::atoi(argv[1]) : 11;
    double angle, width;
    std::cin >> angle >> width;
    F2CCell cell;
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
    }
    Lanes lanes;
    lanes.setAllowOverlap(true);
    Orders orders;
    orders.emplace_back("boustrophedon", std::make_unique<f2c::rp::BoustrophedonOrder>());
    orders.emplace_back("snake", std::make_unique<f2c::rp::SnakeOrder>());
    for (size_t size : {2, 4, 6}) {
        orders.emplace_back("spiral-" + std::to_string(size), std::make_unique<f2c::rp::SpiralOrder>(size));
    }
    std::cout.precision(9);
    for (auto &&[label, order] : orders) {
        for (uint32_t variant = 0; variant < 4; ++variant) {
            F2CSwaths route;
            const double us = median_us(
                runs, [&] { route = order->genSortedSwaths(lanes.generateSwaths(angle, width, cell), variant); });
            print(0, us, label, route);
        }
    }
    if (cell.size() < 2) {
        return 0;
    }
    f2c::decomp::BoustrophedonDecomp decomposition;
    decomposition.setSplitAngle(angle);
    F2CSwathsByCells by_cells;
    const double us = median_us(runs, [&] {
        by_cells = lanes.generateSwaths(angle, width, decomposition.decompose(F2CCells(cell)));
        for (size_t i = 0; i < by_cells.size(); ++i) {
            orders[0].second->genSortedSwaths(by_cells[i], 0);
        }
    });
    for (size_t i = 0; i < by_cells.size(); ++i) {
        if (by_cells[i].size() == 0) {
            continue;
        }
        // Of few lanes a spiral is none, and its snake of two or fewer reads beyond them.
        for (size_t order = 0; order < (by_cells[i].size() > 2 ? 2u : 1u); ++order) {
            for (uint32_t variant = 0; variant < 4; ++variant) {
                F2CSwaths route = orders[order].second->genSortedSwaths(by_cells[i], variant);
                print(i + 1, us, orders[order].first, route);
            }
        }
    }
}
