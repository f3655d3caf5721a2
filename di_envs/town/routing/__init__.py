"""From a route file to a dense route with commands, and the scenarios that it meets.

routes         a route file: keypoints and weather
pieces         lanes cut where CARLA's planner sees several, measured in `traces`
road_graph     the planner's graph over them
snapping       keypoints put onto pieces
router         the way between them: a `RoutePlan`
crossings      the connector of each junction that it crosses
trigger_files  where scenarios may begin
scenarios      which of them the route meets
"""
