"""What the robot makes of its pictures, scans and odometry: plain functions, and nodes around them.

Nothing here knows where the robot or a station really is, nor how large anything is. The rules of the contest say: the
arena is a circle with an octagon in its middle, four filling stations on the octagon and four delivery stations on the
wall. Only that is given (`shape`), and the robot measures the rest (`mapping`). The **map frame** has its origin in the
middle of the arena and its x axis through the middle of a side of the octagon; which of the eight sides that is, each
robot decides for itself when it starts, and keeps.
Poses are arrays `(x, y, theta)`; the **robot's frame** has x ahead and y to the left. Every node fires once for each
value that comes, unless it says otherwise, and is silent where it has nothing to say.

    records      Sighting(label, x, y, facing, score)   a sign, in the robot's frame: label "bullseye" or "1" ... "4";
                     .bearing, .distance; facing is where the panel looks in the robot's frame, NaN if unknown
                 Cube(state, station)                   state "none", "unreadable" or "number"; station 1 ... 4, else 0
                 Localised(pose, covariance, quality, sure, stamp, shape)   `sure` is false while lost or in doubt;
                     .fits: the scan fits, be it the right one of the places that look the same or not
                 Wall(distance, angle)                  a wall ahead: how far, and where it faces (0: straight at it)
                 Disk(x, y, points)                     another robot, in the map frame
                 Station(x, y, theta, sightings)        on the surface; theta looks away from it, into the free
                     .before(distance)                  the pose before it that faces it
    shape        Shape(radius, octagon)                 the map: .distances(places), .side(number), .on_wall(at)
    mapping      first_map(points) -> Shape | None      wall and octagon as one scan shows them              function
                 Survey(shape)                          .learn(points, pose): better with each scan; .shape
    sighting     find_targets(image) -> list[Sighting]          bull's-eyes                              node, function
                 read_digits(image) -> list[Sighting]           digit signs                              node, function
    cube         read_cube(image) -> Cube                       what lies in the basket, one picture     node, function
                 CubeWatch(times=2)   image -> cube; ~> number(int), unreadable, none: seen so often in a row
    laser        obstacle_ahead(scan, direction=, width=) -> float      nearest in a sector, inf: free   node, function
                 wall_ahead(scan, width=) -> Wall | None                                                 node, function
                 other_robots(scan, localised) -> list[Disk]                                             node, function
    localising   Localise()   scan, odometry -> localised; slots sightings(list[Sighting]), signs(dict);
                     ~> lost, found
    signs        SignMap()    sightings, localised -> signs: dict[int, Sign(x, y, theta, sigma, sightings)]; the digits
    stations     StationMap() targets, localised -> filling: list[Station], delivery: list[Station]; from bull's-eyes
                 octagon_sides(scan, localised) -> list[Station]        the sides that the scan shows    node, function
                 delivery_station(sign) -> Station      where the bull's-eye beside a digit is           function
    planning     plan(shape, start, goal, others) -> points | None     the last is the goal                     function
                 PlanPath() slots goal(pose), stop; localised, others -> path: Path(points, heading);
                     ~> aside(Path): where to wait while another one has taken the goal, no_path
    following    follow(path, localised, scan, speed, limits) -> Twist | None      one step; None: there function
                 held_back(velocity, localised, scan, limits)   what leads at nothing too fast           function
                 FollowPath() slots path(Path), aside(Path), stop; localised, scan -> command: Twist;
                     ~> arrived, blocked(float), taken(Path)
                 Queue()      slots aside(Path), path(Path), stop; localised, scan -> command: Twist;
                     ~> free(Path), blocked
"""
